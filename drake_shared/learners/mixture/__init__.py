"""A mixture of experts: one CNMP for each route that was demonstrated."""
