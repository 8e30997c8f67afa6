"""How many of very many points, planes or pairs are asked: three sizes of samples, for all that is told by them.

A share of one half is told to a twentieth by a glance, to a fiftieth by a look and to a hundredth by a count. The least
detail that counts, 0.6 % of a surface, is one of the points of a glance, four of a look and eighteen of a count.
"""

# A glance tells what is hopeless, a look what is likely, and a count decides.
GLANCE, LOOK, COUNT = 120, 600, 3000
# Of candidates in order so many are followed: where evidence tells anything the true one is among the first of them.
FOLLOWED = 4
