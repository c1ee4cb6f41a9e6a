"""Identification methods behind one interface: SSI, pLSCF, FDD and its kin."""
