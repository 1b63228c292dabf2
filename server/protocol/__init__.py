"""Every byte between page and server: records, messages, what may be said when."""
