"""Policies: the policy file, and those that ship."""
