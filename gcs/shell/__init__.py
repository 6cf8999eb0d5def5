"""The ground station's side effects: links, processes, terminal."""
