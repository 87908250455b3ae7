"""Learned policies: samples, networks, trainers, baselines, export. Needs the extra `train`."""
