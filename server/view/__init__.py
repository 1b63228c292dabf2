"""What is shown of a robot: the 3D view (viser behind a proxy), and a robot of light."""
