"""Worlds for TorchRL: environments, collectors with the policy inside the core, updates, validation runs."""
