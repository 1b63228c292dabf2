"""From spots of a film to the places of the LEDs."""
