"""VIZ: a 3D viewer of the map, in which people draw hazardous areas that keep the hand away."""
