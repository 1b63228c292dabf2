"""`lightleash experiments contact`: pushing a wall, plugging in; compliant beside stiff."""
