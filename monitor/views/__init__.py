"""Pictures of results: report, viewer, plots."""
