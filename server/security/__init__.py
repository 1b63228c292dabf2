"""Who gets a place, who may come in, and what he may do."""
