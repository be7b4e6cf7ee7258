"""From frames of a camera to the light of every LED: what live and recorded sensors share."""
