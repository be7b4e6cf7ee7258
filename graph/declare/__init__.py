"""What a node is: its declaration, how it is found, described, written anew and proved."""
