"""The sources of training batches: corpora, and the masks that objects are cut out with."""
