"""Commands `new structure` and `new site`: commented files to begin with."""
