"""The record of a trial: one MCAP file, its schema, writer, reader, export to tables, and the wall-clock sidecar."""
