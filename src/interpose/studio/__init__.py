"""The studio: motion in-betweening in a browser, served on the loopback."""
