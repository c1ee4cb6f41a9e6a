"""Binary files of this folder, written by pyYeti 1.4.7 from the formatted ones."""

from pyyeti.nastran import op4

both = {name: op4.read(f"{name.lower()}.op4")[name.lower()] for name in ("KGG", "MGG")}
for name, form, order in (("dense", "dense", "<"), ("sparse", "nonbigmat", ">"), ("large", "bigmat", "<")):
    op4.write(f"{name}.op4", both, sparse=form, endian=order)
