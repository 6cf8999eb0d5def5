"""The live page: what running vehicles report, as JSON for a browser, and what a browser requests of them.

Without sockets and clocks: datagrams and times come in, records and datagrams go out.
"""
