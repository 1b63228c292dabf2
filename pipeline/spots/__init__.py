"""Picture → bright spots to a hundredth of a pixel, with their covariance. Sec. V-A."""
