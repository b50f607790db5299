"""What is wrong with a measured circle: findings with number, limit and unit. Pure mathematics, shared by all who judge runs.

Limits follow from the noise that a run itself shows, from what other runs of its session show, and from how well the place
of the circle is known; each is passed by chance so seldom that a sound run has any finding once in a thousand.
"""
