"""The paper's training stages (section 5.4) over a rendered corpus."""
