"""Mathematics with no IMU in it: vectors, information, variance components, consistency."""
