"""The figures of chapter 4 and of the appendix, one module per family; `catalogue` lists them."""
