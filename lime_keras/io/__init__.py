"""Reading and writing of pictures, normal maps and videos."""
