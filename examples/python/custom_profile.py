"""Profiles of your own: an expression in the distance d and the time t, and a table of measured values. The program
prints the force of both at some distances; the pulse is limited to 5 N."""

import forceserver as fs

pulse = fs.Custom("3*(1+sin(12*t))*exp(-d/0.01)", sense="repulsive", limit=5)
click = fs.Custom([2, 2.4, 2.6, 1.5, 0.4, 0.1, 0], step=0.001, sense="repulsive", limit=5)  # a push-button, N each mm

distances = [0, 0.0015, 0.003, 0.0045, 0.006]  # m
at_start, later = fs.intensity(pulse, distances), fs.intensity(pulse, distances, time=0.13)
table = fs.intensity(click, distances)
print("distance   pulse, t = 0 s   t = 0.13 s     click")
for row in zip(distances, at_start, later, table):
    print(f"{1e3 * row[0]:5.1f} mm {row[1]:14.2f} N {row[2]:10.2f} N {row[3]:7.2f} N")
