"""Who does the work: this process, a pool of isolated ones, or a cluster; one file each, all of one form.

An executor is a function of jobs that yields lists of outcomes as they come; closing it ends the work at once.
"""
