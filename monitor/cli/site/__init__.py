"""Commands that work on a site and its running monitor."""
