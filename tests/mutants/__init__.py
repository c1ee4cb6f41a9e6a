"""Small faults put into modules, and the tests that should notice them."""
