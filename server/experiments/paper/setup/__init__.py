"""The paper's experimental setup: tasks, flights, figures, assumptions."""
