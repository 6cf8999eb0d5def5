"""The autopilot's side effects: options, storage, sockets, processes."""
