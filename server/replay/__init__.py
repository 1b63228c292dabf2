"""Recorded phones, live through a server or offline through the pipeline alone."""
