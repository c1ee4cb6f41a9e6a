"""Pictures of a history, an identification, frequency responses and a structure; matplotlib is loaded by them."""
