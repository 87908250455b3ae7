"""Other people's libraries tried on the environments, each in a virtual environment of its own."""
