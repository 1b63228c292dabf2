"""Can LEDs be told apart, how well do they show a pose, and what layout is better?"""
