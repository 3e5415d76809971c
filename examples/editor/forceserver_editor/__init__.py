"""The force editor: shows in a browser all that can be felt at a force-server, and changes any of it while it is felt."""
