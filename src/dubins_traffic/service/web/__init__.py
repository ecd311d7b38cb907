"""The service as a web application: pages for people, an API for programs, and the door of the workers."""
