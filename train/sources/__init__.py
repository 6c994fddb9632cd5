"""The sources of training batches: banks, corpora, and the masks that objects are cut out with."""
