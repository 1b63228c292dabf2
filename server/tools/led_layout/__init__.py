"""`lightleash robot leds`: can its LEDs be told apart, and would others be."""
