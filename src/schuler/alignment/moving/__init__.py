"""Finding the attitude of a vehicle that moves, from what else was measured of its motion."""
