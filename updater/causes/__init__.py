"""The catalogue: every cause that a diagnosis may name, one file each."""
