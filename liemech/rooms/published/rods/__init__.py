"""Results of others about rods.

bend.py                a cantilever bent by 45 degrees
elastica.py            a slender cantilever under a large load
princeton.py           a strip that bends about both axes and twists
right_angle_frame.py   a frame that buckles sideways
spaghetti.py           a rod that is thrown, and flies
spaghetti_in_space.py  one that is thrown out of its plane
twisted.py             a twisted cantilever
"""
