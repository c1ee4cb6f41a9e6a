"""Commands that prepare, run and commission a site."""
