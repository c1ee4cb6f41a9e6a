"""Experimental modal analysis: modes of measured frequency responses, with deviations and modal masses."""

from oma.responses.identification import ResponseIdentification as ResponseIdentification
from oma.responses.identification import identify_responses as identify_responses
from oma.responses.identification import identify_responses_all as identify_responses_all
