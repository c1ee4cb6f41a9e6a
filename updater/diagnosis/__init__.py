"""Diagnosis: causes fitted and compared, combined, named, and checked on data not used."""
