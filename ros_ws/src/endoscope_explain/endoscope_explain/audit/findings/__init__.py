"""What can be wrong with a recording: a file has its kinds of finding and the step that finds them.

A step's `find` takes what was examined so far and gives it on with its findings, put right by them.
"""
