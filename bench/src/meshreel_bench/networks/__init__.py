"""Network traces for studies with viewers: files, and the program that made them."""
