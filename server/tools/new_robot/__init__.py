"""`lightleash robot new`: a first robot file, asked for."""
