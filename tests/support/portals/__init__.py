"""Portal frames by a finite element code of their own, and records of them."""
