"""`lightleash experiments all`: every experiment, as one page that stands by itself.

`parts` lists what is flown, `running` flies each in a process of its own and keeps what became of
it, `results` reads the files it wrote, `tables` makes tables of them, `page` the page;
`provenance` is what it all ran on.
"""
