"""The paper's two networks in torch, and their export to policy files and ONNX."""
