"""The live page: what running vehicles say, as JSON for a browser, and what a browser asks of them.

Neither sockets nor clocks: datagrams and times come in, records and datagrams go out.
"""
