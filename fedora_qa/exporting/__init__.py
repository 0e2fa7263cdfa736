"""Write a sequence in a layout of others, for looking and for evaluation: read in blocks, entirely or not at all.

``tum`` writes a trajectory as text, ``dsec`` the folder of a sequence.
"""
