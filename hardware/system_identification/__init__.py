"""A plant's numbers, by what a robot was told in flight and what its motion sensors measured."""
