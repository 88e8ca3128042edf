"""Rows of the table for a result, and for the summary of a batch: there one row an input and method, at the root."""

from __future__ import annotations

from .variable import tables

GROUPS = tables("""
[phases]
component(component) text [required]: pendulum, or difference of two pendulums
amplitude(component, time) rad [required, missing]: amplitude of the near-resonant harmonic
amplitude_sigma(component) rad [nonnegative, missing]: standard deviation of the amplitude from the readings of a window
phase(component, time) rad [required, missing]: phase of the near-resonant harmonic, unwrapped
phase_sigma(component, time) rad [nonnegative, missing]: standard deviation of the phase from the readings of a window
phase_speed(component, time) rad s-1 [missing]: time derivative of the phase, central differences
slow(component, time) rad [missing]: slow forced part of the elongation
phase_qc(component, time) flags: quality flags of the phase
fictitious_amplitude(time) rad [missing]: amplitude of the fictitious pendulum theta1 - (n1/n2) theta2, slow motion \
and all
fictitious_phase(time) rad [missing]: phase of the fictitious pendulum, unwrapped
formula(formula) text: formula of Panteleev (1958)
phase_speed_by_formula(formula, time) rad s-1 [missing]: phase speed of the difference, in (9) of the fictitious \
pendulum, that the formula gives
amplitude_rate(time) rad s-1 [missing]: time derivative of the difference's amplitude
amplitude_rate_by_27(time) rad s-1 [missing]: time derivative of the difference's amplitude that (26) and (27) give

[correction]
estimator(estimator) text [required]: name of the method
non_isochronism(estimator, time) rad s-1 [missing]: what unequal periods and damping add, corrected
arc(estimator, time) rad s-1 [missing]: what finite arcs take off, corrected
acceleration(estimator, time) rad s-1 [missing]: what acceleration of the support does, corrected
phase_speed_correction(estimator, time) rad s-1 [missing]: correction of the phase speed, added: the sum of its parts
phase_correction(estimator, time) rad [missing]: correction of the phase, added
corrected_phase_speed(estimator, time) rad s-1 [missing]: phase speed of the difference, corrected
corrected_gravity(estimator, time) m s-2 [missing]: gravity that the corrected phase speed stands for

[gravity]
estimator(estimator) text [required]: name of the method
gravity(estimator) m s-2 [required, positive, missing]: gravity after all corrections of the method
gravity_sigma(estimator) mGal [required, nonnegative, missing]: standard deviation of gravity
epoch(estimator) epoch: time that gravity holds for
pendulum(pendulum) text: label of the pendulum
frequency(estimator, pendulum) rad s-1 [positive, missing]: circular frequency at infinitesimal arc
frequency_sigma(estimator, pendulum) rad s-1 [nonnegative, missing]: standard deviation of the circular frequency
entry(entry) text: name of the correction
value(estimator, entry) mGal [missing]: correction of gravity, added
sigma(estimator, entry) mGal [nonnegative, missing]: standard deviation of the correction; 1 % of it where no input \
states one
value_period(estimator, entry) 1e-7 s [missing]: correction of the full period of the second pendulum, added
applied(estimator, entry) u1: 1 where the correction is in the gravity of the method
reason(estimator, entry) text: why the correction was applied or not
input(estimator, entry) text: variables of the record that the correction was made from
formula(entry) text: formula of the correction
formula_source(entry) text: where the formula comes from
noise_sigma(estimator) mGal [nonnegative, missing]: standard deviation of gravity from the readings alone
source(source) text: what makes gravity uncertain
share(estimator, source) 1 [nonnegative, missing]: share of the variance of gravity that a source brings
advice(estimator) text: what to improve to halve the standard deviation
uncorrected(estimator) m s-2 [missing]: gravity before any correction
normal_gravity() m s-2: normal gravity of GRS80 at the latitude, at the height or, below the sea, at its surface
free_air_anomaly(estimator) mGal [missing]: free-air anomaly
bouguer_anomaly(estimator) mGal [missing]: simple Bouguer anomaly, the sea as rock
flag(flag) text: what the reader of the result must know, one flag an entry
flag_meaning(flag) text: what the flag says

[course]
gravity_course(time) m s-2 [required, positive]: gravity along the track, all corrections applied; its mean is that \
of method joint
gravity_course_sigma(time) mGal [required, nonnegative]: standard deviation of gravity along the track

[ship]
horizontal_acceleration(time) m s-2 [missing]: horizontal acceleration of the support, as estimated
vertical_acceleration(time) m s-2 [missing]: vertical acceleration of the support, as estimated

[difference]
record_time(record_time) epoch [required]: time of the sample, from the start of the record
elongation(record_time) rad [missing]: elongation of the difference, as read
model(record_time) rad [missing]: elongation of the difference, as fitted
residual(record_time) rad [missing]: elongation less what was fitted

[spectrum]
frequency(frequency) s-1 [required, nonnegative]: frequency
residual_spectrum(frequency) rad2 s [nonnegative]: power spectral density of the residual, one-sided

[pendulums]
pendulum(pendulum) text [required]: label of the pendulum
record_time(record_time) epoch [required]: time of the sample, from the start of the record
theta(pendulum, record_time) rad [missing]: angle of the pendulum from the vertical, as fitted

[period]
period() s [required, positive, missing]: full period at infinitesimal arc
period_sigma() s [required, nonnegative, missing]: standard deviation of the full period
cycle_time(cycle) s [missing]: middle of the cycle, from the start of the record
amplitude(cycle) rad [nonnegative, missing]: amplitude of the cycle
cycle_period(cycle) s [positive, missing]: full period of the cycle
cycle_period_smoothed(cycle) s [positive, missing]: full period of the cycle, smoothed
cycle_period_infinitesimal(cycle) s [positive, missing]: full period of the cycle, reduced to infinitesimal arc
flag(flag) text: what the reader of the result must know, one flag an entry

[synchrony]
clock(clock) text [required]: label of the pendulum
pair(pair) text [required]: two pendulums, first less second
phase(clock, time) rad [required, missing]: phase of the swing, unwrapped
amplitude(clock, time) rad [nonnegative, missing]: amplitude of the swing
frequency(clock) rad s-1 [positive]: mean circular frequency
phase_difference(pair, time) rad [required, missing]: phase difference, unwrapped
phase_difference_sigma(pair, time) rad [nonnegative, missing]: standard deviation of the phase difference
rate_difference(pair, time) day-1 [missing]: swings that the first makes more, at each instant
mean_rate_difference(pair) day-1: swings that the first makes more, over the record
mean_rate_difference_sigma(pair) day-1 [nonnegative]: standard deviation of the mean rate difference
verdict(pair) text [required]: in phase, antiphase, quadrature, other angle, drifting, or intermittent
confidence(pair) 1 [required, nonnegative]: probability of the verdict
locked_angle(pair) rad [missing]: phase difference at which the pair is locked
locked_angle_sigma(pair) rad [nonnegative, missing]: standard deviation of the locked angle
lock_time(pair) s [missing]: time from which the pair is locked
slips(pair) 1 [nonnegative]: whole swings that one gained on the other
slip_time(slip) s: time of a slip
slip_pair(slip) text: pair that slipped
amplitude_ratio(pair) 1 [nonnegative]: amplitude of the first over the second
beam_amplitude() m [nonnegative]: amplitude of the support's motion
beam_ratio(clock) m rad-1 [nonnegative]: amplitude of the support over that of the clock
averaging_time(averaging) s [positive]: averaging time of the Allan deviation
allan_deviation(clock, averaging) 1 [nonnegative, missing]: overlapping Allan deviation of the clock's relative rate

[summary]
record_id(row) text: identity of the record
input(row) text: input file
output(row) text: result file, below the folder of the batch
error(row) text: why there is no value
flags(row) text: flags of the method, separated by blanks
status(row) u1 [required]: what became of the input by this method
error_class(row) u1 [required]: kind of the fault
requested_method(row) u1 [required]: method that was asked for
method(row) u1 [required]: method that was used
gravity_m_s2(row) m s-2 [required, missing]: gravity
gravity_sigma_mgal(row) mGal [required, missing]: standard deviation of gravity
uncorrected_m_s2(row) m s-2 [required, missing]: gravity without any correction
noise_sigma_mgal(row) mGal [required, missing]: standard deviation of gravity by reading noise alone
correction_mgal(row) mGal [required, missing]: sum of all corrections
difference_frequency_rad_s(row) rad s-1 [required, missing]: mean phase speed of the difference, uncorrected
period_s(row) s [required, missing]: full period at infinitesimal arc
period_sigma_s(row) s [required, missing]: standard deviation of the period
samples_used(row) 1 [required, missing]: samples that were used
""")

SUMMARY = GROUPS["summary"]
