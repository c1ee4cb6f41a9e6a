"""Command `response`: motion and stresses where there is no sensor."""
