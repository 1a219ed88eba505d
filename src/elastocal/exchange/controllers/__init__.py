"""Programs with joint targets in the languages of robot controllers, one module each: `catalogue` finds them."""
