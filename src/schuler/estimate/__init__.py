"""Mathematics with no IMU in it: directions (TRIAD, Wahba), information."""
