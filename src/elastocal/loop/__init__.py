"""Close the loop on a campaign: from its folder to the verdict, with the tables in
between. The packages below do the science.
"""
