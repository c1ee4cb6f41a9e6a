"""Experimental modal analysis: modes of measured frequency responses, with deviations and modal masses."""

from oma.responses.identification import ResponseIdentification, identify_responses, identify_responses_all

__all__ = ["ResponseIdentification", "identify_responses", "identify_responses_all"]
