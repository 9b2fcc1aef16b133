"""The stages composed: messages in time order in, trajectory and cloud out; the same objects offline and online."""
