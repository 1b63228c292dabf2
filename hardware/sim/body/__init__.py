"""The body of a robot as a camera sees it, with its arms, propellers and cable."""
