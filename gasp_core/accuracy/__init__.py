"""How far a result is to be trusted: measures of error."""
