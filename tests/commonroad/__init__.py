"""CommonRoad's own library, commonroad-io, beside which the readers of its protobuf files are held."""
